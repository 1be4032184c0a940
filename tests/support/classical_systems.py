"""Small systems with known integrals, as texts of models."""

SPHERE = """
name: sphere
coordinates: [x, y, z]
parameters: {m: 1.3, g: 9.81, l: 0.7}
T: m/2*(x'^2 + y'^2 + z'^2)
V: m*g*z
constraints: {surface: x^2 + y^2 + z^2 = l^2}
initial: {x: 0.4, y: 0.2, z: {guess: -0.5}, x': 0.3, y': 1.1, z': {guess: 0}}
"""

FREE_SPHERE = SPHERE.replace("g: 9.81", "g: 0").replace("name: sphere", "name: free_sphere")

#: Kepler's problem of two bodies in space: 3 momenta, 3 angular momenta, and the energy.
TWO_BODIES = """
name: two_bodies
coordinates: [x_1, y_1, z_1, x_2, y_2, z_2]
parameters: {m_1: 2, m_2: 0.7, k: 1.9}
definitions:
  r: sqrt((x_2 - x_1)^2 + (y_2 - y_1)^2 + (z_2 - z_1)^2)
T: m_1/2*(x_1'^2 + y_1'^2 + z_1'^2) + m_2/2*(x_2'^2 + y_2'^2 + z_2'^2)
V: -k/r
initial:
  {x_1: 0, y_1: 0.1, z_1: 0, x_2: 1.2, y_2: 0, z_2: 0.3,
   x_1': 0.1, y_1': -0.3, z_1': 0.2, x_2': 0, y_2': 1.1, z_2': 0.1}
"""

#: A sleigh whose centre of mass is over the edge spins at a constant rate.
CENTRED_SLEIGH = """
name: centred_sleigh
coordinates: [x, y, theta]
parameters: {m: 1.5, J: 0.2}
T: m/2*(x'^2 + y'^2) + J/2*theta'^2
constraints: {knife: y'*cos(theta) = x'*sin(theta)}
initial: {x: 0, y: 0, theta: 0.3, x': 1, y': {guess: 0}, theta': 2}
"""

#: A ball that rolls on a plane: by the contact force no moment about the contact point arises.
ROLLING_BALL = """
name: rolling_ball
coordinates: [x, y, e0, e1, e2, e3]
parameters: {m: 0.5, R: 0.05, J: 5e-4}
definitions:
  w_x: 2*(e0*e1' - e1*e0' + e2*e3' - e3*e2')
  w_y: 2*(e0*e2' - e2*e0' + e3*e1' - e1*e3')
T: m/2*(x'^2 + y'^2) + 2*J*(e0'^2 + e1'^2 + e2'^2 + e3'^2)
constraints:
  unit: e0^2 + e1^2 + e2^2 + e3^2 = 1
  roll_x: x' = R*w_y
  roll_y: y' = -R*w_x
initial:
  {x: 0, y: 0, e0: 1, e1: 0, e2: 0, e3: 0, x': 0.2, y': -0.1,
   e0': {guess: 0}, e1': {guess: 0}, e2': {guess: 0}, e3': 0.4}
"""

#: A charge in a uniform field, in a gauge in which only one translation leaves L alone.
LANDAU_GAUGE = """
name: landau_gauge
coordinates: [x, y]
parameters: {m: 0.3, q: 2, B: 1.1}
T: m/2*(x'^2 + y'^2)
V: -q*B*x*y'
initial: {x: 0.1, y: 0, x': 0.4, y': -0.2}
"""

#: An isotropic oscillator that turns with a table at a prescribed rate.
TURNTABLE = """
name: turntable
coordinates: [x, y, phi]
parameters: {m: 1, k: 3, l: 0.4, Omega: 1.7}
T: m/2*(x'^2 + y'^2) + 0.1*phi'^2
V: k/2*((x - l*cos(phi))^2 + (y - l*sin(phi))^2)
constraints: {drive: phi = Omega*t}
initial: {x: 0.5, y: 0, phi: 0, x': 0.1, y': 0.9, phi': {guess: 1}}
"""
