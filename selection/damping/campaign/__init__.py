"""Campaigns: files with several runs, levels, modes and sensors to one record a mode and the response of every sensor."""
