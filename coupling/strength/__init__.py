"""What vibration does to the structure: fatigue data of materials, utilisation, life."""
