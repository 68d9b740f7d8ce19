"""The process of the map: frames of sensors in, changes for the service's guard out."""

from armguard.service.mapping.process import MapProcess

__all__ = ["MapProcess"]
