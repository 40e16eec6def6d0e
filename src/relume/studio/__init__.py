"""Pages in a browser over the public functions: a local server, the files it may show, and the canvas they share."""
