"""Hostile files: for each format good ones built byte by byte from its specification, what can be wrong with them, and
seeded mutants; and a runner that reads them in a child process and measures. No file is stored: all are made here.

tests/image/test_corpus.py holds every reader to them, and with `-m slow` to 10,000 mutants of each format; a table of
what they do, or of what the files in a folder do, comes from `PYTHONPATH=tests python -m corpus`.
"""
