"""Units as floats, for input and output in SI: `3.5 * units.inch` is in m, `force / units.kN` in kN.

All are exact by definition (the international inch and pound, the US gallon of 231 cubic inches, standard gravity).
"""

import math

# length, m
mm, cm, km = 1e-3, 1e-2, 1e3
inch = 0.0254
foot = 0.3048
# mass, kg
tonne = 1e3
pound = 0.45359237
# force, N
kN, MN = 1e3, 1e6
kgf = 9.80665
lbf = pound * kgf
kip = 1000 * lbf
# moment, N m
kNm = 1e3
ft_lbf = foot * lbf
# pressure, Pa
kPa, MPa, GPa = 1e3, 1e6, 1e9
bar = 1e5
psi = lbf / inch**2
ksi = 1000 * psi
# mass per length, kg/m, and force per length, N/m
lb_per_ft = pound / foot
lbf_per_ft = lbf / foot
# density, kg/m^3; ppg: pounds per US gallon
g_per_cm3 = 1e3  # water has one
ppg = pound / (231 * inch**3)
# volume, m^3
litre = 1e-3
gallon = 231 * inch**3
# angle, rad; angular velocity, rad/s
deg = math.pi / 180
rpm = 2 * math.pi / 60
# angle per length, rad/m: the "dogleg severity" of a well
deg_per_30m = deg / 30
deg_per_100ft = deg / (100 * foot)
# time, s
ms, minute, hour = 1e-3, 60.0, 3600.0
