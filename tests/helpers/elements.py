"""What is inside an element of a URDF."""

from xml.etree.ElementTree import Element


def inner(element: Element, path: str) -> Element:
    """Return the first element at a path inside another one; there must be one."""
    found = element.find(path)
    assert found is not None, f"<{element.tag}> has no {path}"
    return found
