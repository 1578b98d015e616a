"""Schemes: settings, preparation and step apart; `march` walks the steps."""
