"""The analytic models: the object m(theta, gamma), the camera, the sensor's noise, and rendering.

Plain arrays and compiled loops, without torch and without ROS. Imports ``configuration`` only; all
other rooms may import it.
"""
