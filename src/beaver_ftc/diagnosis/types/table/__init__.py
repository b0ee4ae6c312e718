"""The fault types, a file a type, or the two types of one name: contract.py says what is in a row."""
