"""Hostile files: for each format good ones built byte by byte from its specification, what can be wrong with them, and
seeded mutants; and a runner that reads them in a child process and measures. No file is stored: all are made here.
"""
