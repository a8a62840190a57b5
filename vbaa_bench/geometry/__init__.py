"""trimesh meshes of beam, hub, object, background and board, in metres, in Sigma_a."""
