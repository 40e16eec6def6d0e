"""relume"""
