"""The demo: one task played and shown as a table, a video and a web page."""
