"""Programs of others that solve our scenes: a folder with a job goes out, an answer comes back."""
