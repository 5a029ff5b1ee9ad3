"""Yade: 1250 blocks of 8 spheres, bonded where they touch, on a plate; prints sphere-steps per second of CPU time.

    yade -x -n -j1 bonded.py
"""
import os
import sys
import time

from yade import utils

RADIUS, STEPS, BLOCKS = 0.05, 300, (10, 25, 5)
stone = CohFrictMat(young=1e7, poisson=0.3, density=2000, frictionAngle=0.5, isCohesive=True, normalCohesion=1e6, shearCohesion=1e6, momentRotationLaw=True, label="stone")
O.materials.append(stone)
O.materials.append(FrictMat(young=1e7, poisson=0.3, density=0, frictionAngle=0.5, label="plate"))
O.bodies.append(utils.wall((0, 0, 0), axis=2, material="plate"))
edge = 4 * RADIUS * (1 - 1e-4)
places = [2 * RADIUS * (1 - 1e-4) * Vector3(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
for i in range(BLOCKS[0]):
    for j in range(BLOCKS[1]):
        for k in range(BLOCKS[2]):
            corner = Vector3(i * edge, j * edge, k * edge + RADIUS)
            O.bodies.appendClumped([utils.sphere(corner + place, RADIUS, material="stone") for place in places])
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()], verletDist=0.05 * RADIUS),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom6D(), Ig2_Wall_Sphere_ScGeom()],
        [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(setCohesionNow=True), Ip2_FrictMat_FrictMat_FrictPhys()],
        [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(), Law2_ScGeom_FrictPhys_CundallStrack()],
    ),
    NewtonIntegrator(gravity=(0, 0, -9.81), damping=0.2),
]
O.dt = 0.3 * utils.PWaveTimeStep()
O.run(20, True)
spheres = sum(isinstance(body.shape, Sphere) for body in O.bodies)
start = time.process_time()
O.run(STEPS, True)
print("sphere-steps per second:", spheres * STEPS / (time.process_time() - start))
sys.stdout.flush()
os._exit(0)
