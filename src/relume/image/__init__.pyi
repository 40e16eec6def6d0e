from . import files as files
