"""The beam before contact, and what is fixed in the image: learned from the rest images."""
