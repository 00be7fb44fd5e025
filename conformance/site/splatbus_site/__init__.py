"""Lays out the repository for Sphinx: prose as it stands, and pages made from its data.

Pages are a mapping from the path that a Markdown file has in the repository, or would have, to its
text. What is generated is written as if it stood there, links and all.
"""
