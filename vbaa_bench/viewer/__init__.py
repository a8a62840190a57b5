"""Views of a dataset: a recording for the viewer rerun, or an animation and a contact sheet."""
