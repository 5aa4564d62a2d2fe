"""Reports: a page that tells all that an output holds."""
