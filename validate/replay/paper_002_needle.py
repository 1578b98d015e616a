tell = None
published = None
