"""Former places of the pytest plug-in and of the Gymnasium environments."""
