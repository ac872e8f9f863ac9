"""Tables of others as columns: cells of text as numbers, names and dates, and what their columns are called here."""
