"""How Sphinx makes the documentation: Markdown in, pages out; ``make docs``."""

project = "Damping models from vibration tests"
author = "the authors of damping-selection"
extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "Damping models you can stake a design on"
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
