"""Image files from the inside: headers, pixels, and the metadata beside them."""
