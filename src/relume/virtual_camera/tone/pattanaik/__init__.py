"""The multiscale tone operator of Pattanaik, Ferwerda, Fairchild & Greenberg (1998)."""
