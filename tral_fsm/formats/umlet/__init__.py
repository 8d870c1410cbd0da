"""UMLet diagrams."""
