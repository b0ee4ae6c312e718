"""The Generic Transport Model again, from its specification: what the converted one is held against."""
