"""How far two cameras disagree: in pixels over the image, per parameter, and per view."""
