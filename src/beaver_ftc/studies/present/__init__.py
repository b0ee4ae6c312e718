"""What a document looks like: numbers and tables in words, figures, pages, and the files they go into."""
