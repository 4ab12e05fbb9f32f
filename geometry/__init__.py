"""What is in the scene: magnets, rotor, floater, plate, scene file, meshes."""
