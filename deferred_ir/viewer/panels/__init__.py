"""The panels of the viewer's side bar."""
