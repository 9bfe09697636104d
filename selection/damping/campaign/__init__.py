"""Campaigns: files of several levels, modes and sensors to a record a mode and the response of every sensor."""
