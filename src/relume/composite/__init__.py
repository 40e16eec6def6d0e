"""What real surfaces reflect, and renders + plate → picture."""
