"""Videos read, and written beside the sound and whatever else belongs to them, through libav."""
