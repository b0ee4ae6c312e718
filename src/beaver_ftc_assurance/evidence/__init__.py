"""Evidence: a plan of requirements, flown and judged one by one, and the document that says so."""
