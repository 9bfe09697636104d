"""Commands that ``pipelines/cli.py`` registers: files people bring and take away, and folders of results."""
