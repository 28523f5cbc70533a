"""exposures -> image_raw, camera_info."""
