"""NASA's Generic Transport Model: from the user's copy of its data base to an aircraft folder that flies."""
