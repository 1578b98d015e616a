"""Any measured body: its mesh, what moves it, its markers and its motion.

Start with `measured`.
"""
