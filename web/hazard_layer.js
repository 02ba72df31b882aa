// Hazards on the map: one icon per class, gathered into rings that show the mix of classes where
// they are dense, so that the browser never holds more than some hundred markers.

import { svgElement, element } from './dom.js';

const L = window.L;
const PULSE_MS = 4500;

const HazardIcon = L.Icon.extend({
  options: { className: 'pin', iconSize: [34, 42], iconAnchor: [17, 40], popupAnchor: [0, -36] },

  createIcon() {
    const { catalogue, hazardClass, state } = this.options;
    const pin = element('div', { 'data-state': state }, catalogue.badge(hazardClass, state));
    pin.style.setProperty('--colour', catalogue.colour(hazardClass));
    this._setIconStyles(pin, 'icon');
    return pin;
  },

  createShadow() {
    return null;
  },
});

const ClusterIcon = L.Icon.extend({
  options: { className: 'cluster' },

  createIcon() {
    const { count, shares, iconSize } = this.options;
    const node = element('div', {}, ring(shares, count, iconSize[0]));
    this._setIconStyles(node, 'icon');
    return node;
  },

  createShadow() {
    return null;
  },
});

/** A ring whose arcs are the classes' shares, the count in its middle. */
function ring(shares, count, size) {
  const middle = size / 2;
  const radius = middle - 5;
  const around = 2 * Math.PI * radius;
  const svg = svgElement('svg', { width: size, height: size, viewBox: `0 0 ${size} ${size}` },
    svgElement('circle', { class: 'cluster-disc', cx: middle, cy: middle, r: middle - 1 }));
  let start = 0;
  for (const [colour, amount] of shares) {
    const length = (amount / count) * around;
    const arc = svgElement('circle', {
      class: 'cluster-arc', cx: middle, cy: middle, r: radius, stroke: colour,
      'stroke-dasharray': `${length} ${around - length}`, 'stroke-dashoffset': -start,
      transform: `rotate(-90 ${middle} ${middle})`,
    });
    svg.append(arc);
    start += length;
  }
  svg.append(svgElement('text', { class: 'cluster-count', x: middle, y: middle }, shortCount(count)));
  return svg;
}

function shortCount(count) {
  return count < 10000 ? String(count) : `${Math.round(count / 1000)}k`;
}

export class HazardLayer {
  /** `onOpen(hazard)` answers the popup's content; `coveredHeight` of the map's foot, pixels. */
  constructor(map, catalogue, onOpen, coveredHeight) {
    this.coveredHeight = coveredHeight;
    this.map = map;
    this.catalogue = catalogue;
    this.onOpen = onOpen;
    this.markers = new Map();
    this.icons = new Map();
    this.group = L.markerClusterGroup({
      // Pixels: near enough to tell hazards apart on a street, wider where a town is in view.
      maxClusterRadius: (zoom) => (zoom >= 16 ? 26 : 56),
      spiderfyOnMaxZoom: true,
      showCoverageOnHover: false,
      animate: !matchMedia('(prefers-reduced-motion: reduce)').matches,
      iconCreateFunction: (cluster) => this.clusterIcon(cluster),
    });
    this.group.addTo(map);
    this.zooming = false;
    map.on('zoomstart', () => { this.zooming = true; });
    map.on('zoomend', () => { this.zooming = false; });
  }

  /** Exactly these hazards; what stays keeps its marker and its open popup. */
  show(hazards) {
    const wanted = new Set(hazards.map((hazard) => hazard.id));
    const gone = [...this.markers.values()].filter((marker) => !wanted.has(marker.hazard.id));
    for (const marker of gone) this.markers.delete(marker.hazard.id);
    this.group.removeLayers(gone);
    const fresh = [];
    for (const hazard of hazards) {
      if (this.markers.has(hazard.id)) this.update(this.markers.get(hazard.id), hazard);
      else fresh.push(this.createMarker(hazard));
    }
    this.group.addLayers(fresh);
  }

  put(hazard) {
    const marker = this.markers.get(hazard.id);
    if (marker) this.update(marker, hazard);
    else this.group.addLayer(this.createMarker(hazard));
  }

  update(marker, hazard) {
    if (marker.hazard.sequence === hazard.sequence) return;
    if (marker.hazard.state !== hazard.state) {
      marker.setIcon(this.icon(hazard));
    }
    marker.hazard = hazard;
    const { lat, lng } = marker.getLatLng();
    if (lat !== hazard.latitude || lng !== hazard.longitude) {
      marker.setLatLng([hazard.latitude, hazard.longitude]);
    }
    this.refresh(hazard.id);
  }

  /** Draws the hazard's popup anew if it is open; what had the focus in it keeps it. */
  refresh(id) {
    const marker = this.markers.get(id);
    if (!marker?.isPopupOpen()) return;
    const popup = marker.getPopup();
    const active = document.activeElement;
    const focused = popup.getElement()?.contains(active);
    const name = focused ? active.dataset.focus : undefined;
    popup.update();
    if (focused) this.focusPopup(id, name);
  }

  /** The control of this name in the hazard's open popup, else the popup itself. */
  focusPopup(id, name) {
    const content = this.markers.get(id)?.getPopup().getElement()?.querySelector('.popup');
    const control = name ? content?.querySelector(`[data-focus="${name}"]`) : null;
    (control ?? content)?.focus({ preventScroll: true });
  }

  remove(hazard) {
    const marker = this.markers.get(hazard.id);
    if (!marker) return;
    this.group.removeLayer(marker);
    this.markers.delete(hazard.id);
  }

  /** Brings the hazard into view, out of its cluster, and opens its popup. */
  open(hazard) {
    // A zoom that was asked for just now begins with the next frame.
    requestAnimationFrame(() => this.openWhenStill(hazard));
  }

  /** While the map zooms, and clusters split and merge after it, markers come and go, and one that
   * goes takes its popup along. */
  openWhenStill(hazard) {
    const marker = this.markers.get(hazard.id);
    if (!marker) return;
    const again = () => setTimeout(() => this.openWhenStill(hazard));
    if (this.zooming) this.map.once('moveend', again);
    else if (this.group._inZoomAnimation) this.group.once('animationend', again);
    else this.group.zoomToShowLayer(marker, () => marker.openPopup());
  }

  /** A ring that spreads for a moment where something is new, also above a cluster. */
  highlight(hazard) {
    const icon = L.divIcon({ className: 'pulse', iconSize: [64, 64] });
    const pulse = L.marker([hazard.latitude, hazard.longitude],
      { icon, interactive: false, zIndexOffset: -1000 }).addTo(this.map);
    pulse.getElement().style.setProperty('--colour', this.catalogue.colour(hazard.className));
    setTimeout(() => pulse.remove(), PULSE_MS);
  }

  createMarker(hazard) {
    const marker = L.marker([hazard.latitude, hazard.longitude],
      { icon: this.icon(hazard), riseOnHover: true });
    marker.hazard = hazard;
    marker.bindPopup(() => this.onOpen(marker.hazard),
      { minWidth: 296, maxWidth: 296, className: 'hazard-popup', autoPanPaddingTopLeft: [16, 16],
        autoPanPaddingBottomRight: [16, 16 + this.coveredHeight] });
    this.markers.set(hazard.id, marker);
    return marker;
  }

  icon({ className, state }) {
    const key = `${state} ${className}`;
    let icon = this.icons.get(key);
    if (!icon) {
      icon = new HazardIcon({ catalogue: this.catalogue, hazardClass: className, state });
      this.icons.set(key, icon);
    }
    return icon;
  }

  clusterIcon(cluster) {
    const shares = new Map();
    for (const marker of cluster.getAllChildMarkers()) {
      const colour = this.catalogue.colour(marker.hazard.className);
      shares.set(colour, (shares.get(colour) ?? 0) + 1);
    }
    const count = cluster.getChildCount();
    const size = count < 10 ? 38 : count < 100 ? 44 : count < 1000 ? 50 : 58;
    const ordered = [...shares].sort((a, b) => b[1] - a[1]);
    return new ClusterIcon({ count, shares: ordered, iconSize: [size, size] });
  }
}
