"""Renders + plate → picture."""
