"""The documentation as a web site: what mkdocs is told by `mkdocs.yml`, and what is made meanwhile."""
