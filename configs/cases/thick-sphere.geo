// An eighth of a thick-walled sphere, from 10 to 20 mm, of 10-node tetrahedra: `gmsh -3 -bin thick-sphere.geo -o thick-sphere.msh`.
SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 20, 0, Pi/2, Pi/2};
Sphere(2) = {0, 0, 0, 10, 0, Pi/2, Pi/2};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
eps = 1e-3;
inner() = Surface In BoundingBox{-eps, -eps, -eps, 10 + eps, 10 + eps, 10 + eps};
Physical Volume("body") = {3};
Physical Surface("inner") = {inner()};
MeshSize{ PointsOf{ Volume{3}; } } = 3;
MeshSize{ PointsOf{ Surface{inner()}; } } = 1.5;
Mesh.ElementOrder = 2;
Mesh.MshFileVersion = 4.1;
