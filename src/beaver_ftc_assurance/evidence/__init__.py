"""Evidence: fly and judge a plan of requirements, and write a document on the results."""
