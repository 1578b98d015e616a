"""Paper 000: a fluid inclusion in a gelatin phantom, Gosline, Salcudean, Yan (2004)."""
