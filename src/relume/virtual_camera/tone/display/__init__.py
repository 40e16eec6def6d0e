"""Display values → files and pictures for screens, paper and eyes that want numbers."""
