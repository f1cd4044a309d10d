"""What is done with a plan: which object may be relied upon, following the plan, trying again.

`opening` is the front door. Imports ``planning``; without ROS.
"""
