"""The tables: which rows there are, the runs that fill them, and the page that shows them."""
