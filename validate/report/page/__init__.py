"""Page of a report: templates, style, the script, and what the script shows.

`html` fills the templates, and gives the numbers that `page.js` draws with the libraries in
`vendor/` (`manifest.toml`: versions, licences, hashes).
"""
