"""How far a calibration can be trusted: what it does not know, whether it contradicts itself, and one plain verdict."""
