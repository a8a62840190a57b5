"""The antenna's own beam physics: closed forms that relate a shape to contact and force."""
