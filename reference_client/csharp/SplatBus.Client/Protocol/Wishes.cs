// SPDX-License-Identifier: MIT
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>
    /// What the user wants to be in force on the message channel, the newest of each kind, and which of
    /// it this connection has said: it is said again on the next one [CTL-6, POS-7].
    /// </summary>
    public sealed class Wishes
    {
        sealed class Thing
        {
            public Pose Pose;
            public double Scale;
            public bool Said;
        }

        readonly Dictionary<string, Thing> objects = new Dictionary<string, Thing>();
        Pose camera;
        Intrinsics lens;
        string tag;
        double time;
        string[] series;
        bool hasCamera, hasTime, hasSeries, cameraSaid, timeSaid, seriesSaid;

        public void Camera(Pose pose, Intrinsics intrinsics, string name)
        {
            camera = pose;
            lens = intrinsics;
            tag = name;
            hasCamera = true;
            cameraSaid = false;
        }

        public void Object(string id, Pose pose, double scale)
        {
            Thing thing;
            if (!objects.TryGetValue(id, out thing)) objects[id] = thing = new Thing();
            thing.Pose = pose;
            thing.Scale = scale;
            thing.Said = false;
        }

        public void Time(double seconds)
        {
            time = seconds;
            hasTime = true;
            timeSaid = false;
        }

        /// <param name="names">Of the series; null for all.</param>
        public void Telemetry(string[] names)
        {
            series = names;
            hasSeries = true;
            seriesSaid = false;
        }

        /// <summary>Nothing has been said: the connection is new.</summary>
        public void Unsay()
        {
            cameraSaid = timeSaid = seriesSaid = false;
            foreach (Thing each in objects.Values) each.Said = false;
        }

        /// <summary>Members of 1.1 may be said from now on: say the camera with them.</summary>
        public void SayMore()
        {
            if (lens != null || tag != null) cameraSaid = false;
        }

        /// <summary>Say what has not been said, as far as this server takes it.</summary>
        /// <param name="welcome">Null while only 1.0 may be spoken.</param>
        internal void Say(Outbox to, Welcome welcome)
        {
            if (hasCamera && !cameraSaid) SayCamera(to, welcome);
            cameraSaid = true;
            foreach (KeyValuePair<string, Thing> each in objects)
                if (!each.Value.Said) each.Value.Said = SayObject(to, welcome, each.Key, each.Value);
            if (hasTime && !timeSaid && Negotiation.Lists(welcome, Capability.Time)) SayTime(to);
            if (hasSeries && !seriesSaid && Negotiation.Lists(welcome, Capability.Telemetry)) SaySeries(to);
        }

        void SayCamera(Outbox to, Welcome welcome)
        {
            PacketWriter writer = to.Begin("camera_pose");
            WritePose(writer, camera);
            if (welcome != null && tag != null)
            {
                writer.Member("tag", tag);
            }
            if (lens != null && Negotiation.Lists(welcome, Capability.Intrinsics))
            {
                writer.Name("intrinsics");
                Lenses.Write(writer, lens);
            }
            to.Add();
        }

        /// <summary>A server without `objects` knows one, at scale 1 [OBJ-2].</summary>
        static bool SayObject(Outbox to, Welcome welcome, string id, Thing thing)
        {
            bool hasMany = Negotiation.Lists(welcome, Capability.Objects);
            if (!hasMany && (id != "default" || thing.Scale != 1)) return false;
            PacketWriter writer = to.Begin(hasMany ? "object_pose" : "point_cloud_pose");
            if (hasMany)
            {
                writer.Member("object", id);
            }
            WritePose(writer, thing.Pose);
            if (thing.Scale != 1)
            {
                writer.Member("scale", thing.Scale);
            }
            to.Add();
            return true;
        }

        void SayTime(Outbox to)
        {
            PacketWriter writer = to.Begin("set_time");
            writer.Member("time", time);
            to.Add();
            timeSaid = true;
        }

        void SaySeries(Outbox to)
        {
            PacketWriter writer = to.Begin("subscribe_telemetry");
            writer.Name("names");
            if (series == null) writer.Null(); else writer.Texts(series);
            to.Add();
            seriesSaid = true;
        }

        static void WritePose(PacketWriter writer, Pose pose)
        {
            writer.Name("position");
            writer.BeginObject();
            writer.Member("x", pose.X);
            writer.Member("y", pose.Y);
            writer.Member("z", pose.Z);
            writer.EndObject();
            writer.Name("rotation");
            writer.BeginObject();
            writer.Member("x", pose.QX);
            writer.Member("y", pose.QY);
            writer.Member("z", pose.QZ);
            writer.Member("w", pose.QW);
            writer.EndObject();
        }
    }
}
