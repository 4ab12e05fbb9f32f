// A plate in a block of air (metres): extruded layers in the plate would tie the mesh to its faces, so all is tetrahedra.
SetFactory("OpenCASCADE");
DefineConstant[ size = 4e-3 ];
Box(1) = {-0.03, -0.03, -0.005, 0.06, 0.06, 0.01};
Box(2) = {-0.3, -0.3, -0.3, 0.6, 0.6, 0.6};
BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Delete; }
air() = Volume{:};
air() -= {1};
Physical Volume(1) = {1};
Physical Volume(2) = air();
far() = CombinedBoundary{ Volume{:}; };
Physical Surface(3) = far();
MeshSize{ PointsOf{ Volume{:}; } } = 0.1;
MeshSize{ PointsOf{ Volume{1}; } } = size;
