"""Light and shots in the files of other programs, a module or folder a program."""
