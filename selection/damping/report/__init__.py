"""The report: results in, tables, figures and one self-contained HTML page out."""
