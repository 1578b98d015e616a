"""B-mode images: PNG, folders of them, and the outlines of inclusions in them."""
