"""The models that Figure 3 compares with the Cosserat rod, independent implementations for this purpose.

Planar column along z, clamped at the origin, bending towards x; theta turns z towards x. Everything inside is in units
of the length L and of EI/L^2; arguments and results are in SI units.

    corotational   a two-node co-rotational Timoshenko beam, in place of a commercial package's built-in beam
    mcre           a reconstruction of the Modified Cosserat Rod Element, any number of elements, and its limit
    solid_bar      the circular bar itself as a three-dimensional elastic solid
    follow         the path of any of them: load control, arc length, limit points
"""
