"""URDF in and out, with what it cannot say in `<beamstiff>` elements that other readers pass over."""
