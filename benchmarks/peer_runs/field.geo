// One cube, or two that touch, in a ball of 60 mm (metres).
SetFactory("OpenCASCADE");
DefineConstant[ size = 3e-3, cubes = 1, angle = 0 ];
e = 0.01;
For k In {1:cubes}
  Box(k) = {-e/2, -e/2, -e/2 + (k - 1)*e, e, e, e};
  Rotate {{0, 1, 0}, {0, 0, 0}, -angle} { Volume{k}; }
EndFor
Sphere(10) = {0, 0, 0, 0.06};
BooleanFragments{ Volume{1:cubes}; Delete; }{ Volume{10}; Delete; }
air() = Volume{:};
air() -= {1:cubes};
For k In {1:cubes}
  Physical Volume(k) = {k};
EndFor
Physical Volume(10) = air();
far() = CombinedBoundary{ Volume{:}; };
Physical Surface(20) = far();
MeshSize{ PointsOf{ Volume{:}; } } = 0.02;
MeshSize{ PointsOf{ Volume{1:cubes}; } } = size;
