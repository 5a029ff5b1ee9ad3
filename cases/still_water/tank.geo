// A closed tank 1 m x 0.25 m x 1 m with an irregular mesh: no element face follows the still water
// surface. Made with: gmsh -3 -format msh41 tank.geo
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 0.25, 1};
Physical Volume("fluid") = {1};
Physical Surface("x_min") = {1};
Physical Surface("x_max") = {2};
Physical Surface("y_min") = {3};
Physical Surface("y_max") = {4};
Physical Surface("z_min") = {5};
Physical Surface("z_max") = {6};
Mesh.MeshSizeMin = 0.065;
Mesh.MeshSizeMax = 0.065;
Mesh.Algorithm3D = 1;
Mesh.Optimize = 1;
