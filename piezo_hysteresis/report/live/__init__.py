"""The page in the browser: a running axis, or a recording, drawn with Bokeh. No ROS."""
