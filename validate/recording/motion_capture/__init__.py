"""Files of motion capture and trackers, one format a module.

`text_rows` holds what the text formats share.
"""
