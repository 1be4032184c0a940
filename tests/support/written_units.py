"""Units as engineers write them: what they mean, and which are refused."""

from __future__ import annotations

import math

#: Units as engineers write them, with the factor and an SI unit of their dimension.
WRITTEN = [
    *(("Nm", 1.0, "N*m"), ("kNm", 1e3, "N*m"), ("mNm", 1e-3, "N*m"), ("Nmm", 1e-3, "N*m")),
    *(("Ncm", 1e-2, "N*m"), ("Nm/rad", 1.0, "N*m"), ("Nm/deg", 180 / math.pi, "N*m")),
    *(("Nm/°", 180 / math.pi, "N*m"), ("Nms", 1.0, "N*m*s"), ("Nms/rad", 1.0, "N*m*s")),
    *(("Ns/m", 1.0, "N*s/m"), ("kNs/m", 1e3, "N*s/m"), ("Ns/mm", 1e3, "N*s/m")),
    *(("mNs", 1e-3, "N*s"), ("Nm s", 1.0, "N*m*s"), ("N/mm", 1e3, "N/m"), ("kN/mm", 1e6, "N/m")),
    *(("N/mm^2", 1e6, "Pa"), ("N/mm²", 1e6, "Pa"), ("N/mm2", 1e6, "Pa"), ("MPa", 1e6, "Pa")),
    *(("GPa", 1e9, "Pa"), ("bar", 1e5, "Pa"), ("mbar", 100.0, "Pa"), ("hPa", 100.0, "Pa")),
    *(("kg m^2", 1.0, "kg*m^2"), ("kg m²", 1.0, "kg*m^2"), ("kgm²", 1.0, "kg*m^2")),
    *(("kgm^2", 1.0, "kg*m^2"), ("kgm2", 1.0, "kg*m^2"), ("kg·m²", 1.0, "kg*m^2")),
    *(("kgcm²", 1e-4, "kg*m^2"), ("gcm²", 1e-7, "kg*m^2"), ("g mm^2", 1e-9, "kg*m^2")),
    *(("rpm", math.pi / 30, "rad/s"), ("U/min", math.pi / 30, "rad/s")),
    *(
        ("rev/min", math.pi / 30, "rad/s"),
        ("rev/s", 2 * math.pi, "rad/s"),
        ("rps", 2 * math.pi, "rad/s"),
    ),
    *(("hp", 745.6998715822702, "W"), ("PS", 735.49875, "W"), ("kW", 1e3, "W")),
    *(("Wh", 3600.0, "J"), ("kWh", 3.6e6, "J"), ("mWh", 3.6, "J"), ("Ah", 3600.0, "C")),
    *(("°", math.pi / 180, "rad"), ("º", math.pi / 180, "rad"), ("°/s", math.pi / 180, "rad/s")),
    *(("deg/s²", math.pi / 180, "rad/s^2"), ("rad/s2", 1.0, "rad/s^2"), ("km/h", 1 / 3.6, "m/s")),
    *(("m·s⁻²", 1.0, "m/s^2"), ("m s^-2", 1.0, "m/s^2"), ("s⁻¹", 1.0, "1/s")),
    *(("l", 1e-3, "m^3"), ("l/min", 1e-3 / 60, "m^3/s"), ("t", 1e3, "kg"), ("min", 60.0, "s")),
    *(("h", 3600.0, "s"), ("in", 0.0254, "m"), ("ft", 0.3048, "m"), ("lb", 0.45359237, "kg")),
    *(("lbf", 4.4482216152605, "N"), ("lbf/in", 4.4482216152605 / 0.0254, "N/m")),
    *(("psi", 4.4482216152605 / 0.0254**2, "Pa"), ("mph", 0.44704, "m/s")),
    *(("daN", 10.0, "N"), ("kgf", 9.80665, "N"), ("kp", 9.80665, "N"), ("kgm/s", 1.0, "kg*m/s")),
    *(
        ("kNm²", 1e3, "N*m^2"),
        ("1/kNm", 1e-3, "1/(N*m)"),
        ("Pas", 1.0, "Pa*s"),
        ("cSt", 1e-6, "m^2/s"),
    ),
    *(("Nm^-1", 1.0, "N/m"), ("kNm^-1", 1e3, "N/m"), ("Nm^-2", 1.0, "Pa"), ("kNm^2", 1e3, "N*m^2")),
    *(("Nmm^2", 1e-6, "N*m^2"), ("Nms^-1", 1.0, "W"), ("Nms^2", 1.0, "kg*m^2")),
    *(("Ns m^-1", 1.0, "N*s/m"), ("N s m^-1", 1.0, "N*s/m"), ("N.s/m", 1.0, "N*s/m")),
    *(("kg m s^-2", 1.0, "N"), ("kg·m·s⁻²", 1.0, "N"), ("kgm^-3", 1.0, "kg/m^3")),
    *(("kg m^-1 s^-2", 1.0, "Pa"), ("mm s^-2", 1e-3, "m/s^2"), ("mm^-1", 1e3, "1/m")),
    *(("rad s^-1", 1.0, "rad/s"), ("rad.s^-2", 1.0, "rad/s^2"), ("m.s^-2", 1.0, "m/s^2")),
    *(("1/(ms)^2", 1e6, "1/s^2"), ("m/(ms)^2", 1e6, "m/s^2"), ("kg/(ms)", 1e3, "kg/s")),
    *(("1/ms", 1e3, "1/s"), ("rad/ms", 1e3, "rad/s"), ("N/ms", 1e3, "N/s"), ("V/ms", 1e3, "V/s")),
    *(("1/mN", 1e3, "1/N"), ("m*N^-1", 1.0, "m/N"), ("m N^-1", 1.0, "m/N")),
    *(
        ("mm4", 1e-12, "m^4"),
        ("kg/m3", 1.0, "kg/m^3"),
        ("g/cm^3", 1e3, "kg/m^3"),
        ("cm³", 1e-6, "m^3"),
        ("µm", 1e-6, "m"),
        ("PS/kg", 735.49875, "W/kg"),
    ),
]

#: Texts that have several readings, or none, with a pattern of the reason.
REFUSED = [
    *((x, "293.15 K") for x in ("°C", "degC", "℃", "º C", "deg C", "celsius", "°F", "degF")),
    *((x, "count revolutions") for x in ("1/min", "min^-1", "min⁻¹")),
    *((x, "lbf for the force") for x in ("lb/in", "lb*ft", "ft lb", "pound/inch")),
    *((x, "ft\\*lbf") for x in ("ftlb", "lbft", "lbfft")),
    *((x, "parentheses") for x in ("J/kg K", "W/m²·K", "N/m/s", "m/s/s", "kg/m s")),
    *((x, "differs between countries") for x in ("gal", "gallon")),
    *((x, "kgf\\*cm for a torque") for x in ("kgcm",)),
    *((x, "write m\\*s\\^-2 with meters") for x in ("ms^-2", "ms⁻²", "ms**-2", "ms-2", "kg ms^-2")),
    *((x, "with meters") for x in ("ms^-1", "ms^2", "ms2", "m/ms^2", "kg/ms^2", "N/ms^-1")),
    *((x, "with meters") for x in ("mN^-1", "mrad^-1", "mPa⁻¹", "kg/ms", "W/mK")),
    *((x, f"did you mean `{y}`") for x, y in (("m s-2", "m s\\^-2"), ("Nm-2", "Nm\\^-2"))),
    *((x, "not a unit") for x in ("mms^-2", "kms^-1", "kgms^-2", "Nsm^-1", "rads^-1", "m/s-2")),
    *((x, "several") for x in ("ton", "kt", "cal", "kcal", "Btu", "mil")),
    *((x, "gon") for x in ("grad", "Grad")),
    ("KN", "did you mean `kN`"),
    ("RPM", "did you mean `rpm`"),
    ("NM", "did you mean `Nm` or `nm`"),
    ("kn", "kN for kilonewtons"),
    ("kmh", "km/h"),
    ("ccm", "write cm\\^3"),
    ("Upm", "write U/min"),
    ("Gal", "cm/s"),
    ("smoot", "not a unit"),  # a unit of Pint
    ("enzyme_unit", "not a unit"),
    ("tex", "not a unit"),
    ("delta_degC", "not a unit"),
]
