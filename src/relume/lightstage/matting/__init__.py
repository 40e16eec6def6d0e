"""Environment mattes: how a subject refracts and reflects what is behind it."""
